lightloom_test(bench_test LINK lt_client)
lightloom_test(cross_check_test LINK lt_client)
lightloom_test(path_report_test LINK lt_client)
lightloom_test(pyramid_test LINK lt_client)
