"""The tabs of the page: what each shows and what visitors can do there."""
