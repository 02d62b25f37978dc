lightloom_test(core_test LINK lt_core)
lightloom_test(check_test LINK lt_core)
lightloom_test(crash_point_test LINK lt_core)
lightloom_test(nearest_test LINK lt_core)
