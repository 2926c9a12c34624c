"""Ways from station to station that are clear of everything, and flights that a battery takes."""
