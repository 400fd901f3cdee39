from benchmarks.orchestration import main

if __name__ == "__main__":
    main()
