"""What several runs, modes or frequencies tell: tables, files and pictures."""
