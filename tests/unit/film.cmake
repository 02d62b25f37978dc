lightloom_test(film_test LINK lt_film)
lightloom_test(splats_only_test LINK lt_film)
lightloom_test(image_io_test LINK lt_png)
lightloom_test(metrics_test LINK lt_metrics)

find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
lightloom_test(compare_test LINK lt_metrics CLI11::CLI11 nlohmann_json::nlohmann_json)
target_sources(compare_test PRIVATE ${CMAKE_SOURCE_DIR}/client/command_compare.cpp ${CMAKE_SOURCE_DIR}/client/output_files.cpp)
