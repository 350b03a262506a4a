"""Output for people: the terminal, tables, pictures, and the files that programs write."""
