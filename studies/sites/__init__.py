"""Several sites of one leg: whether together they tell more than the best of them."""
