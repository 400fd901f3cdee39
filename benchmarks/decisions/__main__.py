from benchmarks.decisions import main

if __name__ == "__main__":
    main()
