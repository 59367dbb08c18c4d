"""Reports on variations: measures of the selected samples, splits, advice for poor searches, contact sheets."""
