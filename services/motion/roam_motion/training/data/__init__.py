"""From recordings to episodes to the tensors that training draws from."""
