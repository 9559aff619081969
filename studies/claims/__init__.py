"""Is every declared property of an integrator true?"""
