from benchmarks.papers.translator import main

if __name__ == "__main__":
    main()
