"""Shape Programs: three languages in which neural networks write shapes, and the networks that write them."""
