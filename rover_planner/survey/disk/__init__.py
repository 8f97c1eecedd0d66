"""What a survey keeps on the disk: files that last, layers that are read by parts."""
