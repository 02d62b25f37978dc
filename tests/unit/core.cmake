lightloom_test(core_test LINK lt_core)
