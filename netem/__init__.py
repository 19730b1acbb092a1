"""The emulated radio: a medium that loses, delays and cuts frames, and the Zenoh router it lives in."""
