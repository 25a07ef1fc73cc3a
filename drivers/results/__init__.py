"""What a run leaves behind: data, files, folders."""
