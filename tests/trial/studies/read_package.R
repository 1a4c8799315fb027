# Loads a study's package by its own script, and prints what it finds.
source("load.R")
cat(nrow(study$sessions), nrow(study$segments), nrow(study$comments), "\n")
cat(class(study$sessions$wall), class(study$segments$finished_by), class(study$sessions$practice), "\n")
cat(attr(study$comments$text, "label"), "\n")
cat(study$comments$text, sep = "\n")
cat(format(study$sessions$wall[1], "%Y-%m-%d %H:%M:%S", tz = "UTC"), "\n")
