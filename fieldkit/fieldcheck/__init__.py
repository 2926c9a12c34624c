"""Before leaving the field: will the photographs of a plot do, and which stations are to be flown again?"""
