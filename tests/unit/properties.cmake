lightloom_test(subspace_weights_test LINK lt_transport)
lightloom_test(tables_test LINK lt_transport)
lightloom_test(gamma_test LINK lt_core)
lightloom_test(bad_input_test LINK lt_transport)
