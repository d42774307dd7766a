"""What makes a model, or a program, fit: losses and loops."""
