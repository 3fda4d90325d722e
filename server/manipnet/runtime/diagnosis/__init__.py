"""Says what is wrong with the tracked bodies that arrive, and what to do: for `status`, the page, and the doctor."""
