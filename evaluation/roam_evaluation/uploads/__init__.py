"""How files that people upload are understood, with nothing said about them."""
