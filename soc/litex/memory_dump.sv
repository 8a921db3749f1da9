// Ends the simulation: writes the main memory to memory.hex, words of 32 bits.
module MemoryDump(input clock, input finish);
  always @(posedge clock)
    if (finish) begin
      $writememh("memory.hex", sim.main_ram);
      $finish;
    end
endmodule
