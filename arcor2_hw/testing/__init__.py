"""The driver conformance suite: what every driver has to keep, as test cases that run on anybody's driver."""
