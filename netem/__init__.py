"""The emulated radio: a medium that loses, delays and cuts frames, and its Zenoh router."""

from netem import compiled

compiled.prefer()
