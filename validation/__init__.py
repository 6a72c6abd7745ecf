"""The solver against closed forms, independent solutions and another code: `make validation`."""
