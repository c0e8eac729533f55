"""Both layers' stiffness from force and ultrasound, of legs that another code pressed."""
