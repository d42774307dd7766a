"""Shape Programs: the languages in which neural networks write shapes; ShapeAssembly is the first of them."""
