from benchmarks.city import main

if __name__ == "__main__":
    main()
