"""What holds with late messages: what is left at the deadline, which delays that allows, who misses it for certain."""
