"""What an agent makes of its sensors: patterns of rays, a map of points seen, trust."""
