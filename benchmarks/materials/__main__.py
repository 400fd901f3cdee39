from benchmarks.materials import main

if __name__ == "__main__":
    main()
