"""What is for torch tensors alone: graphs, and functions whose bits do not depend on the batch."""
