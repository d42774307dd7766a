"""Numbers about shapes and programs. Every function says its unit and where its definition comes from."""
