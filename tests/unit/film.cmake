lightloom_test(film_test LINK lt_film)
