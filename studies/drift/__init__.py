"""What happens over long horizons?"""
