"""Where does each method fail, and how?"""
