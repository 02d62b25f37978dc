find_package(nlohmann_json REQUIRED)
lightloom_test(work_test LINK lt_work)
lightloom_test(wire_test LINK lt_work)
lightloom_test(job_fields_test LINK lt_server nlohmann_json::nlohmann_json)
