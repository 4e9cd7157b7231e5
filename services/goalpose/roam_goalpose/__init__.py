"""Goal poses: a reference pose carried over to an unseen object."""
