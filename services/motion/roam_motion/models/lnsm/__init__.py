"""l-NSM, the paper's motion network (3.2): configuration, features, network, prediction."""
