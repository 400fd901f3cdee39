from benchmarks.street import main

if __name__ == "__main__":
    main()
