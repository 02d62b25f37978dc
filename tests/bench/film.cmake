add_executable(film_bench film_bench.cpp)
target_link_libraries(film_bench PRIVATE lt_film)
