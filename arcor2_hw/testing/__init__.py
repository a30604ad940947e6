"""The driver conformance suite: test cases that every driver has to pass, for use on any driver."""
