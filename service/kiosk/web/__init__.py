"""The kiosk's HTTP: guarded, limited, with files of known names alone."""
