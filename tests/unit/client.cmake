lightloom_test(bench_test LINK lt_client)
lightloom_test(cross_check_test LINK lt_client)
