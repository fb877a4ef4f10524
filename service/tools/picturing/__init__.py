"""Pictures and pages of what was measured on a face: views in colours, histograms, HTML."""
