"""What goes wrong although nothing looks wrong?"""
