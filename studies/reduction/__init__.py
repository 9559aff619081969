"""What does stepping fewer variables save?"""
