"""The routes of the board and what fills their templates."""
