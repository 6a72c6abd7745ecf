"""The study on one page: results/report.html, self-contained."""
