"""What crosses a wire: frames, keys and the session; imports nothing else of this project."""
