"""Do characters move like people? The same measures of captured people and of the product, and a verdict for each."""
