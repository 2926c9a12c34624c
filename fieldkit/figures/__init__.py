"""Results as figures: tables, spreadsheets, and what a terminal shows of them."""
