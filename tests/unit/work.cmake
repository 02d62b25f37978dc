lightloom_test(work_test LINK lt_work)
