"""What a link does, measured: packets through the medium, against what its conditions say."""
