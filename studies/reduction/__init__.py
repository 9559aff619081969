"""What does modelling less buy?"""
