"""What is shown in a terminal or drawn into a picture."""
