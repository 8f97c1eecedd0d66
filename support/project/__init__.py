"""What tests of the project as a whole share: the checkout, its pages, their commands."""
