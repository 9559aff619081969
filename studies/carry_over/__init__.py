"""My body is no symmetric top: which of these verdicts hold for it?"""
