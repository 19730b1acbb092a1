"""What a person sees: the recording and the pictures made of it."""
