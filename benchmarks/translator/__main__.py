from benchmarks.translator import main

if __name__ == "__main__":
    main()
