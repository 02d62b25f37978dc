lightloom_test(weights_test LINK lt_transport)
lightloom_test(transport_test LINK lt_transport)
