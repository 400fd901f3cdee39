from benchmarks.layout import main

main()
